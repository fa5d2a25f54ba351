"""Pictures and the report. The core never imports this package."""
