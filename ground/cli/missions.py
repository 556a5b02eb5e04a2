"""`ground missions`: list the shipped missions."""

from ground.cli.options import Json, print_result


def missions(json: Json = False) -> None:
    """List the shipped missions with their durations."""
    from ground.missions import script

    shipped = {name: script.load(name) for name in script.shipped_names()}
    lines = [f"{name:18s} {script.duration_s(m):5.0f} s  {m.about}" for name, m in shipped.items()]
    result = {
        name: {"duration_s": script.duration_s(m), "about": m.about} for name, m in shipped.items()
    }
    print_result(result, "\n".join(lines), json)
