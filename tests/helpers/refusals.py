"""Captures that a fit makes nothing of: with which reasons they are refused."""

import pytest

from plumbob.calibration.fit import CaptureRefusedError


def reasons(call, *args, **options):
    """Reasons for which a call is refused, the weightiest first."""
    with pytest.raises(CaptureRefusedError) as caught:
        call(*args, **options)
    return caught.value.reasons


def reason_kinds(call, *args, **options):
    return [reason.kind for reason in reasons(call, *args, **options)]
