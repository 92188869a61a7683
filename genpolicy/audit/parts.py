"""What a recorded column says in part: dates by their time of day, free text by its words.

A date is another one each time and an instruction may be put in many words. What decides can be a
part of them: the hour of the day, the word `left`. Each part is a column beside the whole.
"""

import re
from collections.abc import Collection, Iterable
from datetime import datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from genpolicy.audit.data import NOT_RECORDED
from genpolicy.data.variables import Runs

Columns = dict[str, list[Runs | None]]
# Dates of several days are also asked by their time of day, where it varies by so many seconds.
TIME_OF_DAY, HOUR_S, DAY_S = "time of day", 3600.0, 86400.0
EPOCH = datetime(1970, 1, 1)
# Seconds since 1970 of the years that robots were recorded in (1990 to 2100), and finer units.
EPOCH_S, EPOCH_UNITS = (6.3e8, 4.1e9), (1.0, 1e3, 1e6, 1e9)
# More different texts than this are also asked by their words; fewer are groups.
MOST_TEXTS = 12
# A word tells something where so many texts have it and so many have not; so many are asked.
WORD_SHARE, WORD_TEXTS, MOST_WORDS = 0.1, 5, 12
CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:\.\d+)?))?")
WORD = re.compile(r"[^\W_]+")
WITH, WITHOUT = "with", "without"


def parts(columns: Columns, *, without: Collection[str] = ()) -> Columns:
    """Columns made of parts of what others say.

    Args:
        columns: Values by column, an item an episode.
        without: Columns whose words are not asked.
    """
    spoken = {name: runs for name, runs in columns.items() if name not in without}
    return {**_times_of_day(columns), **_words(spoken)}


def number_of(text: str) -> float | None:
    """A number, a truth value, a time of day in s, or a date in s since 1970; None of words."""
    if text.lower() in ("true", "false"):
        return float(text.lower() == "true")
    try:
        return float(text)
    except ValueError:
        pass
    clock = CLOCK.fullmatch(text)
    if clock is not None:
        return int(clock[1]) * 3600.0 + int(clock[2]) * 60.0 + float(clock[3] or 0.0)
    date = _moment(text)
    return None if date is None else (date - EPOCH).total_seconds()


def _moment(text: str) -> datetime | None:
    """A date, by the clock that its recorder had."""
    try:
        return datetime.fromisoformat(text).replace(tzinfo=None)
    except ValueError:
        return None


def _times_of_day(columns: Columns) -> Columns:
    """Columns of dates by their time of day: what is done in the mornings, whatever the date."""
    found: Columns = {}
    for name, runs in columns.items():
        texts = _texts(runs)
        counted = _since_1970(texts)
        dates = counted or {text: item for text in texts if (item := _moment(text)) is not None}
        if len(dates) < len(texts) or len({item.date() for item in dates.values()}) < 2:
            continue
        # By the clock of Greenwich a day's work may reach over midnight.
        begins = _after_the_longest_rest(dates.values()) if counted else 0.0
        seconds = {text: (_second(item) - begins) % DAY_S for text, item in dates.items()}
        if max(seconds.values()) - min(seconds.values()) >= HOUR_S:
            clock = {text: _clock(second) for text, second in seconds.items()}
            found[f"{name} ({TIME_OF_DAY})"] = [_said(item, clock) for item in runs]
    return found


def _texts(runs: list[Runs | None]) -> set[str]:
    """Every known value as text."""
    texts = {_plain(value) for item in runs if item is not None for value in item.values}
    return {text for text in texts if text.lower() not in NOT_RECORDED}


def _plain(value: object) -> str:
    return str(value).strip()


def _said(item: Runs | None, texts: dict[str, str]) -> Runs | None:
    """The same runs with other values."""
    return item and Runs(item.rows, tuple(texts.get(_plain(v), "") for v in item.values))


def _clock(second: float) -> str:
    return str((EPOCH + timedelta(seconds=second)).time())


def _second(item: datetime) -> float:
    """Second of the day."""
    return (item - item.replace(hour=0, minute=0, second=0, microsecond=0)).total_seconds()


def _since_1970(texts: set[str]) -> dict[str, datetime]:
    """Numbers as dates, where all of them are seconds since 1970 in one unit."""
    try:
        numbers = {text: float(text) for text in texts}
    except ValueError:
        return {}
    for unit in EPOCH_UNITS:
        if numbers and all(EPOCH_S[0] <= v / unit <= EPOCH_S[1] for v in numbers.values()):
            return {text: EPOCH + timedelta(seconds=v / unit) for text, v in numbers.items()}
    return {}


def _after_the_longest_rest(dates: Iterable[datetime]) -> float:
    """Second of the day at which the longest time without a date ends."""
    seconds = np.unique([_second(item) for item in dates])
    rests = np.diff(seconds, prepend=seconds[-1] - DAY_S)
    return float(seconds[int(np.argmax(rests))])


def _words(columns: Columns) -> Columns:
    """Each telling word of columns of many texts: whether a text has it."""
    found: Columns = {}
    for name, runs in columns.items():
        texts = _texts(runs)
        if len(texts) <= MOST_TEXTS or any(number_of(text) is not None for text in texts):
            continue
        words = {text: frozenset(WORD.findall(text.lower())) for text in texts}
        for word in _telling(words, runs):
            says = {text: WITH if word in held else WITHOUT for text, held in words.items()}
            found[f'{name} ("{word}")'] = [_said(item, says) for item in runs]
    return found


def _telling(words: dict[str, frozenset[str]], runs: list[Runs | None]) -> list[str]:
    """Words that part the texts most evenly, one of those that part them alike."""
    said = [_plain(value) for item in runs if item is not None for value in item.values]
    held = [words[text] for text in said if text in words]
    least = max(WORD_TEXTS, WORD_SHARE * len(held))
    telling: dict[bytes, tuple[float, str]] = {}
    for word in sorted({word for item in words.values() for word in item}):
        has = np.array([word in item for item in held])
        count = int(np.count_nonzero(has))
        if least <= count <= len(held) - least:
            telling.setdefault(_parts_alike(has), (abs(count - len(held) / 2), word))
    return [word for _, word in sorted(telling.values())[:MOST_WORDS]]


def _parts_alike(has: NDArray[np.bool_]) -> bytes:
    """The same for a word and for what stands wherever it does not."""
    return np.asarray(has ^ has[0]).tobytes()
