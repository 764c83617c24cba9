"""Decide whether a sentence says that the target is in view: the text rule of FindSR (paper, section 4.2).

Models write freely, so this is a rule of thumb. It is the same for every agent, and complete in this module.
"""

from __future__ import annotations

import re
from typing import Final

from humanclaw.records.instructions import ALIASES

SEEN_PIXELS: Final = 100
"""Pixels of the 512 x 512 view from which a target counts as seen."""


def _words(*patterns: str) -> re.Pattern[str]:
    return re.compile("|".join(rf"\b(?:{pattern})\b" for pattern in patterns))


_CLAUSE: Final = re.compile(
    r"[.!](?=\s|$)|[;\n]|,?\s+(?:but|while|whereas|although|though|however|because|so)\s+"
    r"|,?\s+and\s+(?=(?:there|it|i|no|nothing|nobody|none|a|an|the|my|its)\b)"
    r"|,\s+(?=(?:there|it|i|no|nothing|nobody|none|a|an|the|my|its|with|without)\b)"
)
"""Ends of clauses: a full stop, a semicolon, a contrast, and "and" or a comma before a new subject."""
_QUESTION: Final = re.compile(r"(?:[^.!?;\n]|\.(?=\d))*\?")
"""Questions: an agent that asks has not seen the target."""
_HARMLESS: Final = _words(
    r"(?:not|no longer) (?:very |too |so |that )?far(?: away| off)?",
    r"not only|(?:no|without(?: a)?) doubt|can(?:not| ?not|['\u2019]t) be missed",
    r"(?:partly|partially|half|slightly|mostly)[ -](?:hidden|occluded|covered|blocked|out of (?:view|sight))",
    r"(?:no|without(?: an?| any)?) (?:obstacles?|obstructions?)|nothing (?:blocks|between|in the way)",
    r"(?:not|not yet|have not|haven['\u2019]t) (?:yet )?(?:reached|within reach|in reach|close enough|near enough)",
    r"not (?:yet )?touching",
    r"find (?:a|my|the) (?:way|path|route)|search (?:is )?(?:complete|over|done)",
    r"(?:may|might|could|can) be (?:sat on|reached)",
)
"""Negations that do not deny the sighting. They are removed first."""
_OTHER: Final = _words(
    r"flower beds?", r"(?:shower|window|fire) screens?", r"power plants?", r"toilet (?:paper|rolls?|brush)"
)
"""Other things that contain a target's name."""
_NEGATION: Final = _words(
    r"no|not|none|never|neither|nor|nothing|nowhere|without|cannot|cant|zero|hardly|false",
    r"\w+n['\u2019]t|unable|fail(?:s|ed)? to|lacks?|doubt(?:s|ful)?",
    r"absent|missing|invisible|unseen|hidden|occluded|gone|lost|disappeared|vanished|out of (?:view|sight)",
    r"behind (?:me|us)|elsewhere|somewhere else|(?:last|previous) room|earlier|previously|ago|remember(?:ed)?",
)
"""Negations: not there, not here, not now."""
_SEEKING: Final = _words(
    r"looking (?!at|to|straight)(?:\w+ ){0,3}for|looks? for|look(?:s|ing)? (?:around|about|everywhere|elsewhere)",
    r"search(?:es|ing)?|seek(?:s|ing)?|hunt(?:ing)?|yet to (?:see|find)",
    r"(?:need|want|try|trying|have|going|hope|hoping|has)s? to (?:be found|find|locate|reach|see|get)",
    r"(?:to|must|should|will) (?:find|locate)|(?:must|should|will) see|wants? (?:an?|the)",
    r"my (?:goal|task|mission|aim|objective)",
    r"might|may|could|probably|perhaps|maybe|likely|possibly|(?:must|should) be",
    r"assum(?:e|es|ing)|i think|suspect|expect(?:s|ing)?|guess|suppose|presum(?:e|ably)",
)
"""Words of a search, a wish or a guess: the target has not been seen yet."""


def acknowledges(text: str, category: str) -> bool:
    """Tell whether a text says that the target is in view.

    A clause has to name it (category, alias or 'target') without a negation, a search or a guess in the same clause. A
    negation that stands before an enumeration ("neither a couch nor a bed", "no table, couch or bed") holds for all of
    it. Questions say nothing.
    """
    names = "|".join(map(re.escape, (*ALIASES.get(category, (category.replace("_", " "),)), "target")))
    named = re.compile(rf"\b(?:{names})(?:e?s)?\b")
    # "the couch I was looking for" has been found, and "target: couch" only repeats the instruction.
    sought_before = re.compile(rf"\b({names}) (?:that |which )?(?:i|we) (?:was|were|have been|had been) \w+ing for\b")
    asked = re.compile(rf"\btarget(?: object| category)?\s*[:=]\s*(?:an? |the )?(?:{names})\s*(?=[.,;\n]|$)")
    statements = _HARMLESS.sub(" ", _QUESTION.sub(" ", text.lower().replace("_", " ")))
    statements = _OTHER.sub(" ", asked.sub(" ", sought_before.sub(r"\1", statements)))
    return any(
        named.search(clause) and not (_NEGATION.search(clause) or _SEEKING.search(clause))
        for clause in _CLAUSE.split(statements)
    )
