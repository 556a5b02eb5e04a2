"""What leaving runs out did to the numbers that control rests on: results with them and without."""

import msgspec

from sysid.models.model_file import IdentifiedModel, ParameterEstimate, Shift


def shifts(with_all: IdentifiedModel, without: IdentifiedModel) -> tuple[Shift, ...]:
    """Every design number's move, in standard deviations of the estimate without the runs."""
    found = []
    for plane, numbers in without.planes.items():
        before = msgspec.structs.asdict(with_all.planes[plane])
        for number, after in msgspec.structs.asdict(numbers).items():
            if isinstance(after, ParameterEstimate) and after.sd:
                first = before[number].value
                found.append(
                    Shift(plane, number, first, after.value, (first - after.value) / after.sd)
                )
    return tuple(found)
