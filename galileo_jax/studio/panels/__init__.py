"""What stands beside the video at each stage; one file each."""
