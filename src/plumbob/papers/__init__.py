"""The five papers, each run whole: from emulated bytes to its tables and figures.

`reproduce` runs them; each paper has a study of its own, which measures what the paper prints, by its method and by
ours; the file beside it says what each figure is, and the bar that is to be met.
"""
