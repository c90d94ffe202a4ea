"""What has limits along a path: of robots and of mechanisms, and whether a motion keeps them."""
