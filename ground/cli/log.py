"""`ground log`: download logs from the vehicle; inspect, check, export and repair log files."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.connection import connected
from ground.cli.options import (
    GROUND_LINK,
    Address,
    CommandGroup,
    Json,
    Modem,
    Sign,
    VehicleId,
    print_result,
)
from ground.log_tools.formats import ExportFormat, Viewer
from ground.output_files import new_file
from mavlink_io.printable import printable
from mavlink_io.user_data_dir import write_output

if TYPE_CHECKING:
    from ground.client.log_download import Download

app = typer.Typer(
    cls=CommandGroup,
    no_args_is_help=True,
    help="Download logs from the vehicle; inspect, check, export and repair them.",
)


@app.command("list")
def list_logs(
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    json: Json = False,
) -> None:
    """List the logs on the vehicle."""
    from ground.client import log_download

    with connected(connect, sign, vehicle_id, modem) as vehicle:
        logs = log_download.list_logs(vehicle)
    rows = [{"number": log.number, "name": log.name, "bytes": log.bytes} for log in logs]
    lines = [f"{log.number:6d} {log.bytes / 1e6:9.2f} MB  {log.name}" for log in logs]
    print_result({"logs": rows}, "\n".join(lines) or "the vehicle has no logs", json)


@app.command()
def download(
    which: Annotated[
        str,
        typer.Argument(
            metavar="[latest|NUMBER|all]", help="A number that `ground log list` prints."
        ),
    ] = "latest",
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    modem: Modem = None,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder for the logs; existing files are kept.")
    ] = Path("logs"),
    json: Json = False,
) -> None:
    """Download logs from the vehicle and compare checksums; resumes an interrupted download."""
    from ground.cli import progress
    from ground.client import log_download

    with (
        connected(connect, sign, vehicle_id, modem) as vehicle,
        progress.display("logs") as display,
    ):
        selected = log_download.select_logs(log_download.list_logs(vehicle), which)
        downloads = [
            log_download.fetch(vehicle, log, out, display.show_fraction) for log in selected
        ]
    rows = [{**download._asdict(), "file": str(download.file)} for download in downloads]
    print_result({"logs": rows}, "\n".join(map(_format_download, downloads)), json)


def _format_download(download: "Download") -> str:
    """Return one line about a downloaded log."""
    check = "checksum matches" if download.checked else "the vehicle sends no checksum"
    text = f"{download.file}: {download.bytes / 1e6:.2f} MB, {check}"
    if download.resumed_at:
        text += f", resumed at {download.resumed_at / 1e6:.2f} MB"
    return text if download.finished else f"{text}; unfinished: `ground log recover` repairs it"


@app.command()
def info(file: Path, json: Json = False) -> None:
    """Show duration, messages, damage and gaps of a log."""
    from ground.log_tools import foreign
    from ground.log_tools import mcap as logs

    content = foreign.info(file) if foreign.is_foreign(file) else logs.info(file)
    lines = [f"{content['file']}: {content['vehicle_s']:.1f} s, {content['messages']} messages"]
    lines[0] += (
        f", {content['lost_frames']} lost"
        if content["lost_frames"] is not None
        else f" from {content['first_s']:.1f} s"
    )
    lines += [f"  {count:8d}  {printable(topic)}" for topic, count in content["topics"].items()]
    lines += [f"  attached  {printable(name)}" for name in content["attachments"]]
    lines += [f"  damaged   {printable(text)}" for text in content["damage"]]
    lines += [
        f"  gap       {gap['length_s']:.1f} s without data from {gap['start_s']:.1f} s"
        for gap in content["gaps"]
    ]
    print_result(content, "\n".join(lines), json)


@app.command()
def segments(
    file: Path,
    servo_channels: Annotated[
        str | None,
        typer.Option(metavar="RUDDER,ELEVATOR,THRUST", help="Servo outputs, as in `ground refit`."),
    ] = None,
    json: Json = False,
) -> None:
    """Propose segments of a log without marked tests, for `ground refit --segment`."""
    from ground.campaign import refit
    from sysid.data.readers.servo_channels import OutputOptions, parse

    options = OutputOptions(parse(servo_channels) if servo_channels is not None else None)
    marks = refit.propose_segments(file, options)
    rows = [
        {
            "start_s": mark.start_s,
            "stop_s": mark.stop_s,
            "plane": mark.plane,
            "segment": mark.text,
        }
        for mark in marks
    ]
    print_result(
        {"file": str(file), "segments": rows}, f"{file}: {refit.format_segments(marks)}", json
    )


@app.command()
def check_performance(
    file: Path,
    gains: Annotated[
        Path,
        typer.Option(
            metavar="GAINS.param", help="Gains that were flown, as `ground redesign` wrote them."
        ),
    ],
    json: Json = False,
) -> None:
    """Compare the performance in a log with that predicted for its gains; name likely causes."""
    from ground.campaign import refit
    from ground.client import param_file
    from ground.live import monitor_view

    monitored = refit.monitor_log(refit.read_log(file), param_file.require_baseline(gains))
    print_result(monitored, f"{file}: {monitor_view.format_text(monitored)}", json)


@app.command()
def export(
    file: Path,
    format_: Annotated[
        ExportFormat,
        typer.Option(
            "--format",
            help="csv: one file per message type and state.csv, SI units; mat: the same for MATLAB"
            " and Octave; tlog: MAVLink frames; mcap: the log with /caribou/state and"
            " /caribou/scene for Foxglove, Lichtblick and PlotJuggler.",
        ),
    ] = ExportFormat.CSV,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR|FILE",
            help="Folder of the CSV files, else a file. Default: the log's name.",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Write a log as CSV or .mat in SI units, as .tlog, or as MCAP for log viewers."""
    from ground.log_tools import export as exports

    target = out or exports.default_target(file, format_)
    if format_ != ExportFormat.CSV:
        new_file(target)
    written = exports.export(file, target, format_)
    print_result({"files": [str(t) for t in written]}, "\n".join(map(str, written)), json)


@app.command()
def layout(
    viewer: Annotated[
        Viewer, typer.Argument(help="Foxglove and Lichtblick share a layout.")
    ] = Viewer.FOXGLOVE,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Default: caribou.foxglove.json or caribou.plotjuggler.xml."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Write a layout for a log viewer; it shows logs of `ground log export --format mcap`."""
    from ground.log_tools import layouts

    target = new_file(out or Path(viewer.file_name))
    write_output(target, layouts.read(viewer))
    print_result({"file": str(target)}, str(target), json)


@app.command()
def recover(
    file: Path,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.mcap", help="Default: NAME-recovered.mcap.")
    ] = None,
    json: Json = False,
) -> None:
    """Copy the readable messages of an unfinished or damaged log to a new, finished log."""
    from ground.log_tools import mcap as logs

    target = new_file(out or file.with_name(f"{file.stem}-recovered.mcap"))
    saved = logs.recover(file, target)
    lines = [f"{target}: {saved.messages} messages saved"]
    lines += [f"  damaged   {text}" for text in saved.damage]
    print_result({"file": str(target), **saved._asdict()}, "\n".join(lines), json)
