"""The page of `dsd report`: one HTML file that holds everything and asks for nothing."""
