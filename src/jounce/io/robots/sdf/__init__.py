"""SDF: models, scopes, poses, links, joints and shapes, and parts that are left out."""
