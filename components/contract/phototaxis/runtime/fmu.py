"""Options that put Functional Mock-up Units in the place of the built-in sensor models."""

from typing import Annotated

from msgspec import Meta, Struct


class FmuOptions(Struct, kw_only=True):
    """Which sensor models an FMU replaces, and how its variables are connected."""

    light_fmu: str = ""
    """an FMU (FMI 2.0 or 3.0 co-simulation) in the place of the built-in light model"""
    sonar_fmu: str = ""
    """an FMU in the place of the built-in sonar model"""
    fmu_map: list[str] = []
    """OUR=THEIRS: connect our input or output OUR to the FMU's variable THEIRS (may be repeated); with two FMUs
    light.OUR=THEIRS or sonar.OUR=THEIRS"""
    fmu_param: list[str] = []
    """NAME=VALUE: set the start value of an FMU parameter or of an unconnected input; for an array give
    VALUE,VALUE,… (may be repeated); with two FMUs light.NAME=VALUE or sonar.NAME=VALUE"""
    fmu_step: Annotated[float, Meta(ge=0)] = 0.0
    """step size of the FMU in seconds, of which the control period must be a multiple; 0: the step size that the
    FMU's description prefers, or else one step per control period"""
    fmu_fresh: bool = False
    """begin each episode with a fresh instance of the FMU, instead of resetting it"""
    fmu_log: bool = False
    """switch on the FMU's logging and show all its messages; without this, only warnings are shown"""
    fmu_fallback: bool = False
    """use the built-in model when the FMU keeps failing, instead of ending"""
    fmu_timeout: Annotated[float, Meta(gt=0)] = 5.0
    """seconds after which an FMU process that does not answer is killed"""
    allow_compile: bool = False
    """compile an FMU that contains only C source: this runs the build instructions of its author"""
    allow_invalid: bool = False
    """use an FMU whose model description does not validate against the standard's schema"""
