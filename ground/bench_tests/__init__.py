"""Tests on the bench: tailcone sweep and inclining test."""
