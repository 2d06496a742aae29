"""Documentation, names, frames, and the program behind `python -m debias`.

    PYTHONPATH=BUILD/python DEBIAS_PROGRAM=BUILD/bin/debias \
        /usr/bin/python3 tests/python/own_conventions_test.py
"""

import os
import subprocess
import sys
import unittest

import numpy as np

import debias
from debias import chains

import own_kept_test
from own_shared import Quiet


class Conventions(Quiet):
    def test_examples_of_the_documentation(self):
        """Each public name has an example that runs, and each function says what it takes and gives."""
        import doctest

        modules = [debias, chains]
        try:
            import matplotlib
        except ImportError:
            pass
        else:
            matplotlib.use("svg")
            modules.append(debias.plot)
        tried = 0
        for module in modules:
            for name in module.__all__:
                thing = getattr(module, name)
                if isinstance(thing, (int, type(debias))):
                    continue
                with self.subTest(f"{module.__name__}.{name}"):
                    self.assertTrue(thing.__doc__, "no docstring")
                    test = doctest.DocTestFinder(recurse=isinstance(thing, type)).find(thing, name, module=False, globs={})
                    examples = [t for t in test if t.examples]
                    self.assertIn(name, [t.name for t in examples], "no example")
                    for t in examples:
                        out = []
                        failed, n = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(t, out=out.append)
                        self.assertEqual(failed, 0, "".join(out))
                        tried += n
                    if not isinstance(thing, type) and thing.__code__.co_argcount:
                        self.assertRegex(thing.__doc__, r"(?s)Parameters\n    -+\n.*Returns\n    -+\n")
        self.assertGreater(tried, 90)

    def test_the_names_are_the_api(self):
        self.assertEqual(set(dir(debias)) - {"__version__", "__doc__", "plot"}, set(debias.__all__))
        self.assertTrue(issubclass(debias.NoPmfError, debias.Error))
        self.assertEqual(debias.estimate.__module__, "debias")

    def test_frames(self):
        result = debias.estimate(own_kept_test.Kept.PROBLEMS["array"], samples=2000)
        for package, call in (("pandas", lambda: result.to_frame()), ("xarray", lambda: result.to_xarray())):
            try:
                __import__(package)
            except ImportError:
                self.raises(ImportError, package, call)
                continue
            found = call()
            if package == "pandas":
                self.assertEqual(len(found), len(result.levels))
            else:
                np.testing.assert_array_equal(found["mean"], result.mean)

    def test_python_m_debias_is_the_program(self):
        program = os.environ.get("DEBIAS_PROGRAM")
        if not program:
            self.skipTest("no program")
        said = subprocess.run([sys.executable, "-m", "debias", "list", "pmfs"], capture_output=True, text=True)
        self.assertEqual(said.stdout, subprocess.run([program, "list", "pmfs"], capture_output=True, text=True).stdout)
        self.assertIn("geometric", said.stdout)


if __name__ == "__main__":
    unittest.main()
