"""Influence of the runs that were left out on the design numbers."""

import msgspec

from sysid.models.model_file import IdentifiedModel, ParameterEstimate, Shift


def shifts(with_all: IdentifiedModel, without: IdentifiedModel) -> tuple[Shift, ...]:
    """Compare the design numbers of two models.

    Parameters
    ----------
    with_all : IdentifiedModel
        Model from all runs.
    without : IdentifiedModel
        Model without the runs that were left out.

    Returns
    -------
    tuple of Shift
        Change of each number, also in standard deviations of the estimate without these runs.
    """
    changes = []
    for plane, plane_model in without.planes.items():
        before = msgspec.structs.asdict(with_all.planes[plane])
        for number, after in msgspec.structs.asdict(plane_model).items():
            if isinstance(after, ParameterEstimate) and after.sd:
                first = before[number].value
                changes.append(
                    Shift(
                        plane=plane,
                        number=number,
                        with_all=first,
                        value=after.value,
                        sds=(first - after.value) / after.sd,
                    )
                )
    return tuple(changes)
