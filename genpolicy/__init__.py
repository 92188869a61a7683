"""The library: measures; knows neither DVC nor Prefect nor gates."""
