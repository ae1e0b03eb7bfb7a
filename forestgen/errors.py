"""What can go wrong, in three words: the input, a stage, or the missing renderer."""


class ForestgenError(Exception):
    """Base of all errors meant for the user: one line that says where, what and what to do."""


class InputError(ForestgenError):
    """A file, stroke or setting that the user can mend (exit code 2)."""


class StageError(ForestgenError):
    """This photo defeats this stage; other trees of the scene can still be built (exit code 1)."""


class RenderError(ForestgenError):
    """No OpenGL to render with (exit code 3)."""
