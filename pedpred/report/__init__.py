"""Tables, figures and pages: numbers in, text or pictures out; nothing here is measured."""
