"""A light sensor as an FMU in Python: it sees nothing behind it, and becomes less sensitive in bright light.

pip install pythonfmu
python -m pythonfmu build -f examples/python_fmu.py
phototaxis fmu check TiringEye.fmu
phototaxis up --light-fmu TiringEye.fmu --fmu-param recovery=5
"""

import math

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class TiringEye(Fmi2Slave):
    """The sensor; its variables have the names that Phototaxis looks for, so it needs no --fmu-map."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.distance = self.bearing = self.reading = 0.0
        self.brightness = self.visibility = 1.0
        self.recovery = 2.0
        self.tired = 0.0
        for name in ("distance", "bearing", "brightness", "visibility"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        self.register_variable(Real("reading", causality=Fmi2Causality.output))
        tunable = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.tunable}
        self.register_variable(Real("recovery", description="time constant, s", **tunable))

    def exit_initialization_mode(self):
        self.tired = 0.0  # each episode begins here, also after a reset

    def do_step(self, current_time, step_size):
        light = self.visibility * self.brightness / max(self.distance, 1.0) ** 2
        if abs(self.bearing) > math.pi / 2:
            light = 0.0
        self.reading = light * (1 - 0.04 * self.tired)
        self.tired += (light - self.tired) * step_size / self.recovery
        return True


if __name__ == "__main__":
    raise SystemExit("this is the source of an FMU; build it: python -m pythonfmu build -f examples/python_fmu.py")
