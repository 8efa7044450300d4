"""The library: what ``import robotrue as rt`` offers, over the operations of the command line."""
