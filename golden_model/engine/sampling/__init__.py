"""The rays of texels, what they bring, and the running average."""
