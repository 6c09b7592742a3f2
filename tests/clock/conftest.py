"""The same random cases on every machine, slow or not."""

from hypothesis import settings

settings.register_profile("plumbob", deadline=None, derandomize=True)  # the same cases on every machine, slow or not
settings.load_profile("plumbob")
