"""Every picture that README and docs show, made by `make figures`."""
