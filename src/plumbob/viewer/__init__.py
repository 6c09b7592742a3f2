"""The live page: a feed beside the stream, a server in its own process, and what a page and its server say."""
