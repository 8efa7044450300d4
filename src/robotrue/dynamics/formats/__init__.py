"""Files of frequency responses and force records: one file per format, no science."""
