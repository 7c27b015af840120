"""Social-force simulation (Helbing & Molnar 1995) of people in cluttered spaces."""
