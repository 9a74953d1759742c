"""Options that put Functional Mock-up Units in the place of the built-in sensor models."""

from typing import Annotated

from msgspec import Meta, Struct


class FmuOptions(Struct, kw_only=True):
    """Which sensor models come from an FMU, and how they are wired."""

    light_fmu: str = ""
    """an FMU (FMI 2.0 or 3.0 co-simulation) in the place of the built-in light model"""
    sonar_fmu: str = ""
    """an FMU in the place of the built-in sonar model"""
    fmu_map: list[str] = []
    """OUR=THEIRS: our input or output is the FMU's variable of another name (may be repeated); with two FMUs
    light.OUR=THEIRS or sonar.OUR=THEIRS"""
    fmu_param: list[str] = []
    """NAME=VALUE: the start value of a parameter of the FMU, or of an input that is not connected; of an array
    VALUE,VALUE,… (may be repeated); with two FMUs light.NAME=VALUE or sonar.NAME=VALUE"""
    fmu_step: Annotated[float, Meta(ge=0)] = 0.0
    """seconds of one step of the FMU, of which the control period is a whole number; 0: as the FMU's description
    wants it, or one step a control period"""
    fmu_fresh: bool = False
    """begin each episode with a fresh instance of the FMU, in place of a reset"""
    fmu_log: bool = False
    """switch the FMU's logging on and show what it says; otherwise its warnings alone are shown"""
    fmu_fallback: bool = False
    """go on with the built-in model when the FMU keeps failing, instead of ending"""
    fmu_timeout: Annotated[float, Meta(gt=0)] = 5.0
    """seconds after which an FMU that does not answer is ended"""
    allow_compile: bool = False
    """compile an FMU that comes as C source alone: this runs its author's build"""
    allow_invalid: bool = False
    """use an FMU whose description fails the validation against the standard's schema"""
