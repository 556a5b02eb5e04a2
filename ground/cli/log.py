"""``ground log``: the logs that the vehicle keeps on board, and what can be done with a log that is
here."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.options import GROUND_LINK, Address, Json, Sign, new_file, print_result
from mavlink_io.printable import printable

if TYPE_CHECKING:
    from ground.client.log_download import Download

app = typer.Typer(
    no_args_is_help=True, help="Fetch logs from the vehicle, look into them, export and mend them."
)


@app.command("list")
def list_logs(connect: Address = GROUND_LINK, sign: Sign = None, json: Json = False) -> None:
    """The logs on board."""
    from ground.client import log_download
    from ground.client.vehicle import connected

    with connected(connect, sign) as vehicle:
        logs = log_download.list_logs(vehicle)
    rows = [{"number": log.number, "name": log.name, "bytes": log.bytes} for log in logs]
    lines = [f"{log.number:6d} {log.bytes / 1e6:9.2f} MB  {log.name}" for log in logs]
    print_result({"logs": rows}, "\n".join(lines) or "the vehicle has no logs", json)


@app.command()
def download(
    which: Annotated[
        str, typer.Argument(metavar="[latest|NUMBER|all]", help="A number of ground log list.")
    ] = "latest",
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where they go; what is there is kept.")
    ] = Path("logs"),
    json: Json = False,
) -> None:
    """Fetch logs from the vehicle: goes on where it was interrupted, and compares checksums."""
    from ground import progress
    from ground.client import log_download
    from ground.client.vehicle import connected

    with connected(connect, sign) as vehicle, progress.display("logs", quiet=json) as shown:
        wanted = log_download.select_logs(log_download.list_logs(vehicle), which)
        fetched = [log_download.fetch(vehicle, log, out, shown.share) for log in wanted]
    rows = [{**each._asdict(), "file": str(each.file)} for each in fetched]
    print_result({"logs": rows}, "\n".join(map(_format_download, fetched)), json)


def _format_download(fetched: "Download") -> str:
    how = "checked" if fetched.checked else "the vehicle gives no checksum"
    words = f"{fetched.file}: {fetched.bytes / 1e6:.2f} MB, {how}"
    if fetched.resumed_at:
        words += f", {fetched.resumed_at / 1e6:.2f} MB of it were here"
    return words if fetched.finished else f"{words}; it has no end: ground log recover mends it"


@app.command()
def info(file: Path, json: Json = False) -> None:
    """What a log holds."""
    from ground.log_tools import foreign
    from ground.log_tools import mcap as logs

    found = foreign.info(file) if foreign.is_foreign(file) else logs.info(file)
    lines = [f"{found['file']}: {found['vehicle_s']:.1f} s, {found['messages']} messages"]
    lines[0] += (
        f", {found['lost_frames']} lost"
        if found["lost_frames"] is not None
        else f" from {found['first_s']:.1f} s"
    )
    lines += [f"  {count:8d}  {printable(topic)}" for topic, count in found["topics"].items()]
    lines += [f"  attached  {printable(name)}" for name in found["attachments"]]
    lines += [f"  damaged   {printable(text)}" for text in found["damage"]]
    print_result(found, "\n".join(lines), json)


@app.command()
def monitor(
    file: Path,
    gains: Annotated[
        Path,
        typer.Option(metavar="GAINS.param", help="What was flown, as `ground redesign` wrote it."),
    ],
    json: Json = False,
) -> None:
    """Whether the vehicle kept what her gains promise, and what is likely the matter if not."""
    from ground.campaign import refit
    from ground.client import param_file as files
    from ground.live import monitor_view

    kept = refit.monitor_log(refit.read_log(file), files.require_baseline(gains))
    print_result(monitor_view.as_json(kept), f"{file}: {monitor_view.format_text(kept)}", json)


@app.command()
def export(
    file: Path,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Default: the log's name.")
    ] = None,
    json: Json = False,
) -> None:
    """Write every MAVLink message of a log as CSV, a file a message."""
    from ground.log_tools import foreign
    from ground.log_tools import mcap as logs

    write = foreign.export_csv if foreign.is_foreign(file) else logs.export_csv
    tables = write(file, out or file.with_suffix(""))
    print_result({"files": [str(t) for t in tables]}, "\n".join(str(t) for t in tables), json)


@app.command()
def recover(
    file: Path,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.mcap", help="Default: NAME-recovered.mcap.")
    ] = None,
    json: Json = False,
) -> None:
    """Save what an unfinished or damaged log holds into a finished one."""
    from ground.log_tools import mcap as logs

    target = new_file(out or file.with_name(f"{file.stem}-recovered.mcap"))
    saved = logs.recover(file, target)
    lines = [f"{target}: {saved.messages} messages saved"]
    lines += [f"  damaged   {text}" for text in saved.damage]
    print_result({"file": str(target), **saved._asdict()}, "\n".join(lines), json)
