"""The tests keep their machine code in a folder of their own."""

import pytest


@pytest.fixture(autouse=True, scope="session")
def cache_folder_of_the_tests(tmp_path_factory: pytest.TempPathFactory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FLIPDIAGRAM_CACHE_DIR", str(tmp_path_factory.mktemp("kernels")))
        yield
