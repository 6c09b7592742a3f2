"""What the pages of all papers must be: each text in both languages, each item done by outcomes that exist."""

import re

from plumbob.reporting.content import Both, said
from tests.helpers.labels import labels, texts


def english_alone(report, known):
    """Texts and labels of a page that are said in English alone, but for what has no other word in Chinese."""
    shown = {*texts(report), *labels(report)}
    assert len(shown) > 10
    plain = {text for text in shown if not isinstance(text, Both) and said(text, "zh") == text}
    return {text for text in plain if not re.match(known, text) and re.search("[a-z]{4}", re.sub(known, "", text))}


def by_key(outcomes):
    """Outcomes by their keys, of which no two are the same; each says in Chinese what it is."""
    keyed = {one.key: one for one in outcomes}
    assert len(keyed) == len(outcomes)
    assert all(isinstance(one.what, Both) and re.search("[\u4e00-\u9fff]", one.what.zh) for one in outcomes)
    return keyed


def unmet(outcomes):
    return {one.key for one in outcomes if not one.met}


def named(items):
    """Keys of the outcomes that items name as what does them."""
    return {key for item in items for key in re.findall(r"\[([\w.-]+)\]", item.by)}
