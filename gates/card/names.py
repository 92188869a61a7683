"""Words of people on cards and lists: what is not seen, and what looks like something else.

A name decides nothing: ids and keys do. But a list of five entries is reviewed by eye, and one
person under five names that look alike would pass for five.
"""

import unicodedata

from genpolicy.contract.names import says

TOGETHER = (
    frozenset(
        {"LATIN", "CJK", "IDEOGRAPHIC", "HIRAGANA", "KATAKANA", "KATAKANA-HIRAGANA", "BOPOMOFO"}
    ),
    frozenset({"LATIN", "CJK", "HANGUL"}),
)
"""Scripts that names in use have in one word; of any others a word has letters of one alone."""
OF_NO_SCRIPT = ("COMBINING", "MODIFIER")
"""How names of characters begin that stand in words of several scripts."""
LOOKS_LIKE = {
    "A": "\u0391\u0410\u13aa\u15c5\ua4ee",
    "B": "\u0392\u0412\u13f4\u15f7\ua4d0\ua7b4",
    "C": "\u0421\u13df\u2ca4\ua4da",
    "D": "\u13a0\u15de\u15ea\ua4d3",
    "E": "\u0395\u0415\u13ac\u2d39\ua4f0",
    "F": "\u03dc\u15b4\ua4dd\ua798",
    "G": "\u050c\u13c0\u13f3\ua4d6",
    "H": "\u0397\u041d\u13bb\u157c\u2c8e\ua4e7",
    "I": "\u0196\u01c0\u0399\u0406\u04c0\u2c92\u2d4f\ua4f2",
    "J": "\u037f\u0408\u13ab\u148d\ua4d9\ua7b2",
    "K": "\u039a\u041a\u13e6\u2c94\ua4d7",
    "L": "\u13de\u14aa\u2cd0\ua4e1",
    "M": "\u039c\u03fa\u041c\u13b7\u15f0\u2c98\ua4df",
    "N": "\u039d\u2c9a\ua4e0",
    "O": "\u039f\u041e\u0555\u2c9e\u2d54\ua4f3",
    "P": "\u03a1\u0420\u13e2\u146d\u2ca2\ua4d1",
    "Q": "\u2d55",
    "R": "\u01a6\u13a1\u13d2\u1587\ua4e3",
    "S": "\u0405\u054f\u13d5\u13da\ua4e2",
    "T": "\u03a4\u0422\u13a2\u2ca6\ua4d4",
    "U": "\u054d\u144c\ua4f4",
    "V": "\u0474\u13d9\u142f\u2d38\ua4e6",
    "W": "\u051c\u13b3\u13d4\ua4ea",
    "X": "\u03a7\u0425\u2cac\u2d5d\ua4eb\ua7b3",
    "Y": "\u03a5\u0423\u04ae\u13a9\u13bd\u2ca8\ua4ec",
    "Z": "\u0396\u13c3\ua4dc",
    "a": "\u0251\u03b1\u0430",
    "b": "\u0184\u042c\u13cf\u1472\u15af",
    "c": "\u0441\u1d04\u2ca5\uabaf",
    "d": "\u0501\u13e7\u146f\ua4d2",
    "e": "\u0435\u04bd\uab32",
    "f": "\u0584\u1e9d\ua799\uab35",
    "g": "\u018d\u0261\u0581\u1d83",
    "h": "\u04bb\u0570\u13c2",
    "i": "\u0131\u0269\u026a\u03b9\u0456\u04cf\u13a5\ua647\uab75",
    "j": "\u03f3\u0458",
    "k": "\u0138\u03ba\u043a\u1d0b",
    "n": "\u0578\u057c",
    "o": "\u03bf\u03c3\u043e\u0585\u10ff\u1d0f\u1d11\u2c9f\uab3d",
    "p": "\u03c1\u0440\u2ca3",
    "q": "\u051b\u0563\u0566",
    "r": "\u0433\u1d26\u2c85\uab47\uab48\uab81",
    "s": "\u01bd\u0455\ua731\uabaa",
    "u": "\u028b\u03c5\u057d\u1d1c\ua79f\uab4e\uab52",
    "v": "\u03bd\u0475\u1d20\uaba9",
    "w": "\u026f\u0461\u051d\u0561\u1d21\uab83",
    "x": "\u0445\u1541\u157d",
    "y": "\u0263\u028f\u03b3\u0443\u04af\u10e7\u1d8c\u1eff\uab5a",
    "z": "\u1d22\uab93",
    "ae": "\u00e6\u04d5",
    "oe": "\u0153",
    "\u4e8c": "\u30cb",
    "\u516b": "\u30cf",
    "\u529b": "\u30ab",
    "\u535c": "\u30c8",
    "\u53e3": "\u30ed",
    "\u5915": "\u30bf",
    "\u5de5": "\u30a8",
}
"""Letters by the one that each is drawn like, of the scripts that people write names in today.

Those of one letter each, in use and unchanged by NFKC, that Unicode's list of confusable
characters (UTS 39) has for letters of ASCII, and small k; and katakana for ideographs.
"""
OF_ALPHABETS = "\u0131\u0196\u0269\u01c0\u0263\u028b\u00e6\u0153\u0138"
"""Latin ones among them that people are named with: Turkish, Ewe, Kabiye, Danish.

The others are phonetic signs and small capitals; who writes one in a name means another letter.
"""
_DRAWN = str.maketrans({one: shape for shape, alike in LOOKS_LIKE.items() for one in alike})
_PAIRS = {"rn": "m", "vv": "w", "VV": "W"}
"""Letters of one word that are drawn like one letter."""
_ONE_STROKE = str.maketrans({"I": "l", "1": "l", "0": "O"})


def disguise(name: str) -> str:
    """Why a name may look like another one; empty if it is written as it looks.

    Not told is a name of one script that looks like one of another: whole names of both are in
    use. Of two on a list `as_drawn` tells it.
    """
    if not says(name):
        return "characters that are not seen, or nothing else"
    if unicodedata.normalize("NFKC", name) != name:
        return "letters in another form than the usual one (NFKC)"
    of_words = [(word, _scripts(word)) for word in name.split()]
    for word, scripts in of_words:
        if len(scripts) > 1 and not any(scripts <= known for known in TOGETHER):
            return f"letters of {' and '.join(sorted(scripts)).lower()} in one word"
        if "LATIN" in scripts and (signs := [c for c in word if _is_a_sign(c)]):
            return f"a phonetic sign that looks like the letter {signs[0].translate(_DRAWN)}"
    latin = any("LATIN" in scripts for _, scripts in of_words)
    for word, scripts in of_words:
        if latin and scripts and "LATIN" not in scripts and word.translate(_DRAWN).isascii():
            return f"a word of {min(scripts).lower()} letters that all look like latin ones"
    return ""


def as_read(name: str) -> str:
    """A name as a hurried reader takes it: whatever its case, its spaces and its script.

    Cyrillic, Greek and other letters count as the Latin ones that they look like, two `v` as the
    `w` that they look like, and what stands between letters as nothing.
    """
    drawn = name.translate(_DRAWN).casefold().translate(_DRAWN)
    return "".join(word.replace("vv", "w") for word in _words(drawn))


def as_drawn(name: str) -> str:
    """A name as a careful reader sees it, where strokes are what tells letters apart.

    Capital i, small l and the digit 1 are one stroke, `rn` is drawn like `m` and `vv` like `w`.
    Spaces tell nothing here either.
    """
    words = [word.translate(_ONE_STROKE) for word in _words(name.translate(_DRAWN))]
    for pair, letter in _PAIRS.items():
        words = [word.replace(pair, letter) for word in words]
    return "".join(words)


def _words(name: str) -> list[str]:
    """What stands between spaces, stops and lines."""
    return "".join(c if _is_of_a_word(c) else " " for c in name).split()


def _scripts(word: str) -> set[str]:
    """Scripts of letters and marks of a word, as the names of the characters begin."""
    begin = (unicodedata.name(c, "").partition(" ")[0] for c in word if _is_a_letter(c))
    return {script for script in begin if script not in OF_NO_SCRIPT}


def _is_a_letter(character: str) -> bool:
    return unicodedata.category(character)[0] in "LM"


def _is_a_sign(character: str) -> bool:
    latin = _scripts(character) == {"LATIN"}
    return latin and ord(character) in _DRAWN and character not in OF_ALPHABETS


def _is_of_a_word(character: str) -> bool:
    kind = unicodedata.category(character)
    return kind[0] in "LMN" and not (kind == "Lm" and not _scripts(character))
