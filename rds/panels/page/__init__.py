"""The page around the panels: title, navigation, emergency stop, colours."""
