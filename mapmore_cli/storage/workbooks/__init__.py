"""What runs in a process of its own to read a workbook for `readers/xlsx.py`."""
