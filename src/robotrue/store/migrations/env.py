"""Runs the migrations on the connection that :mod:`robotrue.store.migrate` hands over."""

from __future__ import annotations

from alembic import context

from robotrue.store.schema import Base

connection = context.config.attributes["connection"]
context.configure(
    connection=connection,
    target_metadata=Base.metadata,
    transaction_per_migration=False,
    render_as_batch=connection.dialect.name == "sqlite",
)
context.run_migrations()
