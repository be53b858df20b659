"""What the trial finds: the channels, what they show, and what to write."""

from dataclasses import dataclass

from hil.diagnosis.data.hints import how_to_write


@dataclass(frozen=True)
class Finding:
    """One contradiction in a log.

    Attributes
    ----------
    channels : that are wrong.  what : expected and got.  advice : what to write.
    names_itself : whether a comparison of sensors names it as a cause, so that it may go on.
    certain : whether nothing else explains it; else it is a remark.
    """

    channels: tuple[str, ...]
    what: str
    advice: str
    names_itself: bool = False
    certain: bool = True

    @property
    def text(self) -> str:
        """As one sentence."""
        return f"{self.what}: {self.advice}"


def unit_advice(channels: tuple[str, ...], unit: str) -> str:
    """What to write of channels that are in a unit."""
    if len(channels) == 1:
        return f"{unit}? {_sentence(how_to_write(channels[0], unit))}"
    return f"{unit}? {_sentence(how_to_write(channels[0], unit))}, and so for {', '.join(channels[1:])}"


def sign_advice(channels: tuple[str, ...], positive: str) -> str:
    """What to write of channels whose sign is turned; ``positive`` says which way is positive."""
    return f"{positive}: turn it with sign = -1 under [{channels[0]}] in the --map" + (
        f", and so for {', '.join(channels[1:])}" if len(channels) > 1 else ""
    )


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:]
