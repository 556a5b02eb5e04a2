"""Metadata and parameters as QGroundControl requests and checks them, after its source.

Files in src of github.com/mavlink/qgroundcontrol and the commits that were read:
Vehicle/ComponentInformation/RequestMetaDataTypeStateMachine.cc (2a89e00),
ComponentInformationManager.cc (d5a519e), CompInfoGeneral.cc and CompInfoParam.cc (1c88025);
FactSystem/ParameterManager.cc (e7680e0), ParamHashCheckStateMachine.cc (3b16c62),
ParameterLoadStateMachine.cc (e5a6eb6). Newer copies of ParameterManager.cc, whose functions
``_mavlinkParamSet`` and ``_mavlinkParamRequestRead`` are cited, have no commit in the index read.
"""

import json
import math
import struct
import zlib
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control.params import PARAMETERS
from autopilot.telemetry.autopilot_id import AutopilotId
from mavlink_io.real32 import as_real32
from tests.autopilot.qgroundcontrol import AUTOPILOT, REQUEST_MESSAGE, Connection, Ftp, connect
from tests.helpers.fake_hil import only, texts

ALL_COMPONENTS = 0
COMPONENT_METADATA, COMPONENT_INFORMATION = 397, 395
GENERAL, PARAMETER = 0, 1
"""COMP_METADATA_TYPE."""
BY_NAME = -1
BATCH = 11
"""Number of missing parameters that ``_fillIndexBatchQueue`` requests at once."""
NAMES = [row.name for row in PARAMETERS]


# ComponentInformation


def download_checked(ftp: Ftp, uri: str, crc: int) -> Any:
    """Return a metadata file: ``_requestFile`` keeps it in a cache, whose key is its CRC."""
    assert uri.startswith("mftp://"), "_uriIsMAVLinkFTP; anything else is fetched by HTTP"
    content = ftp.download(uri.removeprefix("mftp://"))
    assert crc == zlib.crc32(content, 0xFFFFFFFF) ^ 0xFFFFFFFF, "_getFileCacheTag"
    return json.loads(content)


def general_metadata(qgc: Connection) -> Any:
    """Return general.json as ``_requestCompInfo`` and ``_requestMetaDataJson`` get it."""
    answer = qgc.message(COMPONENT_METADATA)
    _, crc, padded = struct.unpack("<II100s", bytes(answer.data)[10:-2].ljust(108, b"\0"))
    return download_checked(Ftp(qgc), padded.rstrip(b"\0").decode(), crc)


def parameter_metadata(qgc: Connection) -> Any:
    """Return parameters.json."""
    (row,) = (r for r in general_metadata(qgc)["metadataTypes"] if r["type"] == PARAMETER)
    return download_checked(Ftp(qgc), row["uri"], row["fileCrc"])


def test_general_metadata_has_uri_and_crc_of_each_type(qgc: Connection) -> None:
    """``CompInfoGeneral::setJson``: version 1; a type without uri or fileCrc is left out."""
    general = general_metadata(qgc)
    assert general["version"] == 1, "'Metadata json unsupported version' otherwise"
    for row in general["metadataTypes"]:
        assert isinstance(row["type"], int)
        assert row["type"] != GENERAL
        assert row["uri"]
        assert 0 <= row["fileCrc"] < 2**32, "converted by toLongLong"


def test_parameter_metadata_describes_every_parameter(qgc: Connection) -> None:
    """``CompInfoParam::setJson`` and ``FactMetaData::createFromJsonObject``.

    A key of the wrong JSON type makes the description of a parameter useless.
    """
    described = parameter_metadata(qgc)
    assert described["version"] == 1
    assert [row["name"] for row in described["parameters"]] == NAMES
    for row in described["parameters"]:
        assert row["type"] == "Float", "type of PARAM_VALUE, otherwise no metadata"
        assert all(isinstance(row[key], str) for key in ("shortDesc", "units", "group", "category"))
        assert all(isinstance(row[key], int | float) for key in ("min", "max", "default"))
        for value in row.get("values", ()):
            assert isinstance(value["value"], int | float)
            assert isinstance(value["description"], str)


def test_deprecated_component_info_is_refused_at_once(qgc: Connection) -> None:
    """``_requestCompInfoDeprecated``: UNSUPPORTED is a reply; without one it tries for 3 x 3 s."""
    acknowledgement = only(qgc.command(REQUEST_MESSAGE, COMPONENT_INFORMATION), "COMMAND_ACK")
    assert acknowledgement.result == mavlink.MAV_RESULT_UNSUPPORTED


def test_missing_file_is_refused_at_once(qgc: Connection) -> None:
    """``FTPManager::_openFileROAckOrNak``."""
    (answer,) = Ftp(qgc).ask(
        mavlink.MAV_FTP_OPCODE_OPENFILERO, data=b"/etc/extras/parameters.json.xz"
    )
    assert (answer[3], answer[12]) == (mavlink.MAV_FTP_OPCODE_NAK, mavlink.MAV_FTP_ERR_FILENOTFOUND)


# Reading of parameters


def read(qgc: Connection, name: str, index: int) -> list[Any]:
    return qgc.ask(mavlink.MAVLink_param_request_read_message(1, AUTOPILOT, name.encode(), index))


def test_parameter_list_is_complete_and_indexed(qgc: Connection) -> None:
    """``refreshAllParameters`` sends to component 0; ``_parameterUpdate`` needs every index.

    The first PARAM_VALUE of a component creates its list of missing indices, from 0 to param_count.
    """
    received = qgc.ask(mavlink.MAVLink_param_request_list_message(1, ALL_COMPONENTS))
    values = [m for m in received if m.get_type() == "PARAM_VALUE"]
    assert {m.param_count for m in values} == {len(NAMES)}
    assert [m.param_index for m in values] == list(range(len(NAMES))), (
        "65535 is disregarded before the list"
    )
    assert [m.param_id for m in values] == NAMES, "printable, without spaces"
    assert {m.param_type for m in values} == {mavlink.MAV_PARAM_TYPE_REAL32}, (
        "_factTypeToMavType; integers of 64 bits and REAL64 are not decoded"
    )
    assert {m.get_srcComponent() for m in values} == {AUTOPILOT}, "_vehicle->defaultComponentId()"


def test_batch_of_missing_parameters_is_sent_by_index(qgc: Connection) -> None:
    """``_fillIndexBatchQueue`` after 3 s: param_id empty; the index of the reply is compared."""
    indices = [0, *range(7, 6 + BATCH - 1), len(NAMES) - 1]
    assert len(indices) == BATCH
    for index in indices:
        qgc.harness.station.transmit(
            mavlink.MAVLink_param_request_read_message(1, AUTOPILOT, b"", index)
        )
    qgc.harness.serve()
    values = [m for m in qgc.harness.station.pop_received() if m.get_type() == "PARAM_VALUE"]
    assert [(m.param_index, m.param_id) for m in values] == [(n, NAMES[n]) for n in indices]


def test_parameter_is_read_by_name(qgc: Connection) -> None:
    """``refreshParameter``, also after a failed write: the name of the reply is compared."""
    for name in (NAMES[0], "HDG_P", NAMES[-1]):
        assert only(read(qgc, name, BY_NAME), "PARAM_VALUE").param_id == name


@pytest.mark.parametrize(("name", "index"), [("NO_SUCH", BY_NAME), ("", 6000)])
def test_unknown_parameter_is_reported_at_once(qgc: Connection, name: str, index: int) -> None:
    """``WaitForParamResponseState``: a PARAM_ERROR of this name or index ends the request."""
    error = only(read(qgc, name, index), "PARAM_ERROR")
    assert (error.error, error.param_id, error.param_index) == (
        mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST,
        name,
        index,
    )
    assert error.get_srcComponent() == AUTOPILOT


def test_parameter_hash_is_refused_and_list_follows(qgc: Connection) -> None:
    """``ParamHashCheckStateMachine``, for PX4 only: no hash within 1 s, then the list.

    A PARAM_VALUE of this name would make QGroundControl compare its cache with it.
    """
    received = read(qgc, "_HASH_CHECK", BY_NAME)
    assert only(received, "PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
    assert not [m for m in received if m.get_type() == "PARAM_VALUE"]
    received = qgc.ask(mavlink.MAVLink_param_request_list_message(1, ALL_COMPONENTS))
    assert "_HASH_CHECK" not in {m.param_id for m in received if m.get_type() == "PARAM_VALUE"}


def unpack_parameter_file(content: bytes) -> dict[str, float]:
    """Return the values of ``param.pck`` as ``ParameterManager::_parseParamFile`` reads it."""
    magic, count, total = struct.unpack_from("<HHH", content)
    assert magic in (0x671B, 0x671C)
    assert count == total
    values, name, at = {}, "", 6
    while at < len(content):
        shared, length = content[at + 1] & 0x0F, (content[at + 1] >> 4) + 1
        assert content[at] & 0x0F == 4, "float"
        name = name[:shared] + content[at + 2 : at + 2 + length].decode()
        at += 2 + length
        (values[name],) = struct.unpack_from("<f", content, at)
        at += 8 if content[at - 2 - length] & 0x10 else 4
    assert len(values) == count
    return values


@pytest.mark.parametrize("path", ["@PARAM/param.pck", "@PARAM/param.pck?withdefaults=1"])
def test_ardupilots_parameter_file_has_every_parameter(path: str) -> None:
    """``ParameterLoadStateMachine::_onFTPDownloadingEntry``: from ArduPilot it requests this file.

    Until the download has ended every PARAM_VALUE of component 1 is ignored.
    """
    qgc = connect(AutopilotId.ARDUPILOT)
    params = qgc.harness.vehicle.params
    qgc.ask(mavlink.MAVLink_param_set_message(1, AUTOPILOT, b"HDG_P", 0.75, 9))
    values = unpack_parameter_file(Ftp(qgc).download(path))
    assert values == {name: as_real32(params.get(name)) for name in NAMES}
    assert values["HDG_P"] == 0.75


# Writing of parameters


def write(qgc: Connection, name: str, value: float) -> list[Any]:
    """Send PARAM_SET with the type of PARAM_VALUE, as ``_writeParameterRaw`` does."""
    message = mavlink.MAVLink_param_set_message(
        1, AUTOPILOT, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32
    )
    return qgc.ask(message)


def test_write_is_answered_with_the_written_value(qgc: Connection) -> None:
    """``_mavlinkParamSet``: component, name, type and value must be those of the request.

    Otherwise it writes three times, one second apart, and reports "Parameter write failed".
    """
    changed = {}
    for row in PARAMETERS:
        middle = math.floor(0.5 * (row.minimum + row.maximum))
        changed[row.name] = as_real32(middle if row.integer else row.default)
    for name, value in changed.items():
        reported = only(write(qgc, name, value), "PARAM_VALUE")
        assert (reported.param_id, reported.param_value) == (name, value)
        assert (reported.param_type, reported.param_index) == (
            mavlink.MAV_PARAM_TYPE_REAL32,
            NAMES.index(name),
        )
        assert reported.get_srcComponent() == AUTOPILOT


def test_refused_write_ends_with_error_and_stored_value(qgc: Connection) -> None:
    """``_mavlinkParamSet``: PARAM_ERROR of this name ends the write at once, with its reason.

    The value of PARAM_VALUE goes into the page (``_containerSetRawValue``): the old one.
    """
    assert only(write(qgc, "HDG_P", 0.75), "PARAM_VALUE").param_value == 0.75
    refused = write(qgc, "HDG_P", 99.0)
    error = only(refused, "PARAM_ERROR")
    assert (error.error, error.param_id, error.param_index) == (
        mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE,
        "HDG_P",
        BY_NAME,
    )
    assert only(refused, "PARAM_VALUE").param_value == 0.75
    assert texts(refused)


def test_reset_of_all_parameters_is_acknowledged_and_published(qgc: Connection) -> None:
    """``resetAllParametersToDefaults``: PREFLIGHT_STORAGE with param1 2 and param2 -1."""
    default = as_real32(PARAMETERS[NAMES.index("HDG_P")].default)
    write(qgc, "HDG_P", 0.75)
    received = qgc.command(mavlink.MAV_CMD_PREFLIGHT_STORAGE, 2, -1)
    assert only(received, "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    published = only(received, "PARAM_VALUE")
    assert (published.param_id, published.param_value) == ("HDG_P", default)
