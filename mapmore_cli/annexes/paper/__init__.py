"""What a paper claims, beside what is measured here."""
