"""One Report for every subject: facts, tables, remarks and figures; as text, as JSON, as a page and as a picture."""
