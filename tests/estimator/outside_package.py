"""A package from elsewhere, as ``pip install`` leaves it: one module and its metadata."""

from pathlib import Path

PHYSICS = '''
"""Physics by a rule of thumb: the body leans as its side legs are turned."""

from estimator.physics.base import BackEnd, Readings, sensor_count


class Thumb(BackEnd):
    def __init__(self, settings):
        super().__init__()
        self.settings = settings

    def read(self, pairs):
        self.simulations += len(pairs)
        self.steps += len(pairs)
        readings = Readings.empty(len(pairs), sensor_count(pairs))
        readings.valid[:] = True
        readings.clearance[:] = self.settings.clearance_cap
        readings.tilt[:, 0] = [body.parts[0].length * program[0] for body, program in pairs]
        return readings

    def close(self):
        pass
'''


def install(
    folder: Path,
    entry_points: str,
    *,
    name: str = "bodyschema-thumb",
    version: str = "0.3",
    code: str = PHYSICS,
) -> Path:
    """Writes the package into a folder, which is to be on the path; returns the folder.

    Its one module is called as the package, with an underscore for the dash.
    """
    folder.mkdir(parents=True, exist_ok=True)
    module = name.replace("-", "_")
    (folder / f"{module}.py").write_text(code, "utf-8")
    information = folder / f"{module}-{version}.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n", "utf-8"
    )
    (information / "entry_points.txt").write_text(entry_points, "utf-8")
    return folder
