"""The paper's friction identification from records to result: Figures 3 to 5."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable

from hil.identify.fit import Fit, fit
from hil.identify.model import HEATINGS, Brake, Heating
from hil.identify.record import Record, averaged
from hil.identify.validation import Error, Validation, halves, validate


@dataclass(frozen=True, eq=False)
class Study:
    """Everything found out from one or two records.

    Attributes
    ----------
    fits : one for each heating form that was tried.
    heating : the form that explains the record better, or the one that was asked for.
    errors : of the identification, first and second half of its record.
    repeat : the same form fitted to the validation record: what the intervals cannot know, they show by disagreeing.
    """

    record: Record
    brake: Brake
    fits: Mapping[Heating, Fit]
    heating: Heating
    errors: tuple[Error, Error]
    validation: Validation | None
    repeat: Fit | None

    @property
    def best(self) -> Fit:
        """The fit of the chosen heating form."""
        return self.fits[self.heating]


def identify(record: Record, brake: Brake, other: Record | None = None, heating: Heating | None = None) -> Study:
    """Fit equations (3) and (4) to ``record`` and predict ``other``.

    Parameters
    ----------
    heating : form of the heating term in equation (4); None tries both and takes the likelier.
    """
    record = averaged(record)
    fits = {form: fit(record, brake, form) for form in ((heating,) if heating else HEATINGS)}
    chosen = max(fits, key=lambda form: fits[form].log_likelihood)
    errors = halves(record, fits[chosen].course)
    if other is None:
        return Study(record, brake, fits, chosen, errors, None, None)
    other = averaged(other)
    return Study(record, brake, fits, chosen, errors, validate(fits[chosen], other, brake), fit(other, brake, chosen))


def shipped_records() -> tuple[Traversable, Traversable]:
    """Return the shipped records, synthetic both: test 1, and test 2 at twice the frequency."""
    folder = resources.files("hil.identify") / "data"
    return folder / "dyno_test1.csv", folder / "dyno_test2.csv"
