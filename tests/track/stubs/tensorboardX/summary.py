"""A summary of a text."""


def text(tag, text):
    return {tag: text}
