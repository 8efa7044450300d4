"""A robot, the file layout of an instrument and a post, as folders of TOML files."""

from __future__ import annotations

from pathlib import Path

ROBOTS = Path(__file__).with_name("robots")
LAYOUTS = Path(__file__).with_name("layouts")
POSTS = Path(__file__).with_name("posts")
