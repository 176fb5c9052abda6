"""Who has not installed what environments need is told what to install."""

import subprocess
import sys


def test_a_missing_package_is_named_with_the_extra_that_brings_it():
    code = "import sys; sys.modules['pettingzoo'] = None; import epuck_sim.environments"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "pip install 'epuck-sim[learning]'" in done.stderr.splitlines()[-1]
