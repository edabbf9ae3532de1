"""The simulator: a hand that carries a skin closes on an object (MuJoCo)."""
