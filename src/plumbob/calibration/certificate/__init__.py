"""Certificate: what a calibration looks like to a reader: text, JSON, page."""

from plumbob.calibration.certificate.html import write_html
from plumbob.calibration.certificate.rows import as_dict, refusal_as_dict, refusal_text, text

__all__ = ["as_dict", "refusal_as_dict", "refusal_text", "text", "write_html"]
