"""Units, axes, signs and delays that physics allows: `plumbob doctor`, in Python and on the command line."""

from pathlib import Path

from plumbob.core import check
from plumbob.core.errors import ParameterError
from plumbob.data import ImuData
from plumbob.data.imu import units_unchecked
from plumbob.data.recording import Recording, unsaved
from plumbob.door.reading import read
from plumbob.files.formats import kind_of, resolved_profile
from plumbob.files.profile import Profile
from plumbob.files.text import text_profile
from plumbob.quality.diagnosis import Declared, Diagnosis, Examination


def doctor(
    what: Recording | ImuData | str | Path,
    *,
    profile: Profile | str | Path | None = None,
    unit: str | None = None,
    hemisphere: str | None = None,
) -> Diagnosis:
    """Say which units, axes, signs and delays of the sensors are consistent with physics.

    Gravity and the Earth's field stand still while the body turns, so both must turn in the body as the gyroscope says.

    Parameters
    ----------
    what : Recording, ImuData or path
        The recording, its samples, or its file, read as declared, with its session's card; wrong units are not refused.
    profile : Profile or path, optional
        What the columns of a text file mean; one that lies beside it is found.
    unit : str, optional
        One of several units, by name or number from 1.
    hemisphere : {"north", "south"}, optional
        Where it was recorded: north of the magnetic equator the field points down, which gives the magnetometer's sign.

    Returns
    -------
    Diagnosis
        An answer to every question, `sure`, `likely` or `unknown`, and the lines of a profile that mend what is wrong.

    Raises
    ------
    DecodeError
        If the file cannot be read.
    ParameterError
        If the recording holds no samples, or the hemisphere is neither.
    """
    if hemisphere is not None:
        check.one_of("hemisphere", hemisphere, ("north", "south"))
    declared = Declared(None)
    if isinstance(what, ImuData):
        what = unsaved(what, "the samples")
    if isinstance(what, Recording):
        recording, name = what.of_unit(unit), what.name
    else:
        file = check.path("what", what)
        with units_unchecked():
            recording, name = read(file, profile=profile, unit=unit, calibrated=True).of_unit(None), file.name
        declared = Declared(_profile(file, profile))
    if recording.imu is None:
        raise ParameterError(f"{name} holds an attitude but no sensor data, so there is nothing to compare.")
    return Examination(recording.imu, name, declared, hemisphere).diagnosis()


def _profile(file: Path, profile: Profile | str | Path | None) -> Profile | None:
    """What the columns of a text table were taken for; None of other formats."""
    if kind_of(file, described=profile is not None).name != "text":
        return None
    return text_profile(file, resolved_profile(file, profile))[0]
