"""Commands: parse, call one function below, print."""
