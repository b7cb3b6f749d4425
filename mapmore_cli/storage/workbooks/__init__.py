"""Read workbooks in a separate process, for `readers/xlsx.py`."""
