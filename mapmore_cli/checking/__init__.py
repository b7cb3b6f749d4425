"""The rules of `mapmore check`, which every run applies as well."""
