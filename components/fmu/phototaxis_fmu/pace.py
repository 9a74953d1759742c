"""Plans the steps of an FMU in a control period."""

import math
from typing import NamedTuple

from fmpy.model_description import ModelDescription
from phototaxis.runtime.errors import UserError

MAX_STEPS = 1000
"""Most steps in a control period that an FMU's description may ask for."""


class StepPlan(NamedTuple):
    """The steps of an FMU in a control period."""

    step: float
    """Length of one `doStep`, s."""
    times: int
    """Steps in a control period."""
    remark: str = ""
    """A line about the step size that the FMU's description asks for; "" if the FMU gets it."""


def plan_steps(description: ModelDescription, period: float, asked: float) -> StepPlan:
    """Plan the steps for a control period.

    Parameters
    ----------
    period : the control period, s.
    asked : the step size that the user asks for, s; 0: the one in the FMU's description, or the whole period.

    Raises
    ------
    UserError
        when the control period is not a whole number of the steps asked for.
    """
    if asked:
        times = _fits(asked, period)
        if not times:
            raise UserError(f"--fmu-step {asked:g}: the control period, {period:g} s, is not a whole number of steps")
        return StepPlan(asked, times)
    interface, experiment = description.coSimulation, description.defaultExperiment
    fixed = float(interface.fixedInternalStepSize or 0) if interface is not None else 0.0
    suggested = float(experiment.stepSize or 0) if experiment is not None else 0.0
    variable = interface is not None and interface.canHandleVariableCommunicationStepSize
    own = fixed or (0.0 if variable else suggested)
    if own and 0 < (times := _fits(own, period)) <= MAX_STEPS:
        return StepPlan(own, times)
    wish = own or suggested
    fitting = _fits(wish, period) if wish else 1
    if fitting == 1:
        return StepPlan(period, 1)
    words = "has" if own else "suggests"
    remark = f"{words} steps of {wish:g} s; it gets steps of {period:g} s, the control period"
    hint = f" (for its own: --fmu-step {wish})" if 0 < fitting <= MAX_STEPS else ""
    return StepPlan(period, 1, remark + hint)


def _fits(step: float, period: float) -> int:
    """Return the number of steps in a period; 0 if it is not a whole number, or the step is not a positive length."""
    ratio = period / step
    times = round(ratio) if 0 < ratio < math.inf else 0
    return times if abs(times * step - period) <= 1e-9 * period else 0
