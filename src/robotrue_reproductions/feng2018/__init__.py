"""Feng, Liang, Xi 2018: recursive registration of a CAM model, and slots cut from two sides."""
