"""The extension switched on."""

from tests.ui.conftest import extension  # noqa: F401 - a fixture
