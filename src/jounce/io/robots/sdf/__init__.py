"""SDF: models, scopes, poses, links, joints and shapes, and what is left out."""
