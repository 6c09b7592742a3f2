"""Certificate: what a calibration looks like to a reader: text, JSON, page."""

from plumbob.certificate.html import write_html
from plumbob.certificate.summary import as_dict, refusal_as_dict
from plumbob.certificate.table import refusal_text, text

__all__ = ["as_dict", "refusal_as_dict", "refusal_text", "text", "write_html"]
