"""The multimodality audit: is there a need for a generator, and if not, what is wrong?"""
