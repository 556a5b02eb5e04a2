"""Text of `ground params load`, `ground params rollback` and `ground redesign --upload`."""

from ground.cli.params import format_changes
from ground.client.param_rollback import ParamChange


def test_changes_without_effect_are_counted_only() -> None:
    """A file of all parameters printed 200 lines for one change."""
    changes = (
        ParamChange("DPT_P", 0.13, 0.13),
        ParamChange("HDG_P", 0.65, 0.8),
        ParamChange("HDG_D", 1.5, 1.5),
    )
    assert format_changes(changes, {"HDG_P": "faster", "DPT_P": "same"}) == [
        "  HDG_P                  0.65 ->        0.8  faster",
        "  2 unchanged",
    ]
    assert format_changes(changes[1:2], {})[-1].endswith("0.8")
