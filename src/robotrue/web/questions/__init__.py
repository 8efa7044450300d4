"""What pages ask the process beside the server: one function a question, answers as JSON bytes.

Each opens the workspace by its folder, calls the lower rooms, and packs what they say. Nothing is
computed here that a command would not compute the same.
"""
