"""Posts: formats of written machining programs, one TOML file for each language.

A package outside adds posts by an entry point of the group ``robotrue.posts`` that names the folder
of its files, a :class:`pathlib.Path`; a user names another file with ``--post``.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Final

from robotrue.core.extensions import extension_files
from robotrue.errors import ConfigurationError
from robotrue.program.posts.post_description import Post, read_post

FOLDER: Final = Path(__file__).parent
GROUP: Final = "robotrue.posts"
"""Entry points of packages outside."""


@cache
def read_posts() -> Mapping[str, Post]:
    """Returns the posts by name, those of robotrue first.

    Raises:
        ConfigurationError: A description that cannot be used, or a name twice.
    """
    known: dict[str, Post] = {}
    for path in (*sorted(FOLDER.glob("*.toml")), *extension_files(GROUP)):
        post = read_post(path)
        if post.stated.name in known:
            raise ConfigurationError(
                f"a second post {post.stated.name!r}.", source=path, hint="another name."
            )
        known[post.stated.name] = post
    return MappingProxyType(known)


def choose_post(output: Path, *, name: str | None = None, file: Path | None = None) -> Post:
    """Returns the post that writes a program.

    Args:
        output: File to write, whose suffix names the language where nothing else does.
        name: Of a post.
        file: Description of the user's own.

    Raises:
        ConfigurationError: No such post, several for the suffix, or a suffix of another language.
    """
    posts = read_posts()
    suffix = output.suffix.lower()
    if file is not None:
        named = [read_post(file)]
    elif name is not None:
        named = [post for post in posts.values() if post.stated.name == name]
    else:
        named = [post for post in posts.values() if suffix in post.stated.suffixes]
    if not named and name is not None:
        raise ConfigurationError(f"no post is called {name!r}; there are {', '.join(posts)}.")
    fitting = [post for post in named if suffix in post.stated.suffixes]
    if not fitting:
        allowed = dict.fromkeys(s for post in named or posts.values() for s in post.stated.suffixes)
        raise ConfigurationError(
            f"{output.name}: no program in {named[0].stated.title if named else 'any language'} "
            f"has the suffix {output.suffix or '(none)'}; allowed are {', '.join(allowed)}.",
            hint=f"name it {output.with_suffix(next(iter(allowed))).name}.",
        )
    own = [post for post in fitting if post.source.parent == FOLDER]
    if len(own) == 1:  # a package outside does not take a suffix; it is requested by name
        return own[0]
    if len(fitting) > 1:
        names = [post.stated.name for post in fitting]
        raise ConfigurationError(
            f"{', '.join(names)} all write {suffix}.", hint=f"--language {names[0]}"
        )
    return fitting[0]
