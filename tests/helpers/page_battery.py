"""What every page must be: self-contained, harmless, and without colours of its own in its figures."""

import html.parser
import re

HOSTILE = "<img src=x onerror=\"alert(1)\">$\\frac{1}$ & 'quotes' </svg></style><script>"
VOID = {"meta", "br", "img", "link", "input"}


class Outline(html.parser.HTMLParser):
    """Element names and attributes; complains about elements that do not close."""

    def __init__(self, text):
        super().__init__()
        self.names, self.attributes, self.open = set(), [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.names.add(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.names.add(tag)
        self.attributes += attrs

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


class PageBattery:
    """Tests of a page in which every text that a user can give is `HOSTILE`; inherit, and give a fixture `text`."""

    def test_it_reaches_for_nothing(self, text):
        outside = re.sub(r'xmlns(:xlink)?="http://www\.w3\.org/[^"]*"', "", text)
        assert re.findall(r"https?:|//[a-z]|@import|url\(\s*[\"']?(?!#)", outside) == []
        policies = re.findall(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', text)
        assert policies == ["default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"]
        links = [value for name, value in Outline(text).attributes if name in {"href", "xlink:href", "src"}]
        assert links
        assert all(value.startswith("#") for value in links)

    def test_hostile_names_are_only_text(self, text):
        outline = Outline(text)
        assert not outline.names & {"img", "script", "object", "iframe", "link"}
        assert not [name for name, _ in outline.attributes if name.startswith("on")]
        assert "&lt;img src=x onerror=" in text

    def test_ids_are_unique_and_every_link_has_its_target(self, text):
        attributes = Outline(text).attributes
        ids = [value for name, value in attributes if name == "id"]
        assert len(ids) == len(set(ids))
        targets = set(re.findall(r"url\(#([^)]*)\)", text)) | {v[1:] for n, v in attributes if n == "xlink:href"}
        assert targets <= set(ids)

    def test_figures_have_no_colour_of_their_own(self, text):
        drawings = "".join(re.findall(r"<svg.*?</svg>", text, flags=re.DOTALL))
        assert "var(--blue)" in drawings
        assert re.findall(r"#[0-9a-f]{6}\b(?=[;\"])", drawings) == []
