"""Jin, Sun, Tang, Li 2022: milling error from components of joints and force."""
