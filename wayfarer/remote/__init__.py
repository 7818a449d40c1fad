"""What a person sees of a rover from afar, and may ask of it: all that can touch a wheel over a network is here."""
