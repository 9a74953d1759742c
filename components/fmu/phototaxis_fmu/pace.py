"""How often an FMU is stepped in a control period."""

import math
from typing import NamedTuple

from fmpy.model_description import ModelDescription
from phototaxis.runtime.errors import UserError

MAX_STEPS = 1000
"""Most steps in a control period that an FMU's description may ask for."""


class StepPlan(NamedTuple):
    """A control period as an FMU goes through it."""

    step: float
    """Length of one `doStep`, s."""
    times: int
    """Steps in a control period."""
    remark: str = ""
    """What the FMU would rather have; "" where it gets it."""


def plan_steps(description: ModelDescription, period: float, asked: float) -> StepPlan:
    """The steps for a control period, as asked (s; 0: as the FMU's description wants it).

    Raises
    ------
    UserError
        when what is asked does not fit the period.
    """
    if asked:
        times = _fits(asked, period)
        if not times:
            raise UserError(f"--fmu-step {asked:g}: the control period, {period:g} s, is no whole number of such steps")
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
    hint = f" (--fmu-step {wish} gives it its own)" if 0 < fitting <= MAX_STEPS else ""
    return StepPlan(period, 1, remark + hint)


def _fits(step: float, period: float) -> int:
    """How many such steps are the period; 0 when it is no whole number of them, or the step is no length."""
    ratio = period / step
    times = round(ratio) if 0 < ratio < math.inf else 0
    return times if abs(times * step - period) <= 1e-9 * period else 0
