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
    """NAME=VALUE: a parameter of the FMU (may be repeated); with two FMUs light.NAME=VALUE or sonar.NAME=VALUE"""
    fmu_fallback: bool = False
    """go on with the built-in model when the FMU keeps failing, instead of ending"""
    fmu_timeout: Annotated[float, Meta(gt=0)] = 5.0
    """seconds after which an FMU that does not answer is ended"""
    allow_compile: bool = False
    """compile an FMU that comes as C source alone: this runs its author's build"""
