"""What Python itself needs: many tasks on several processes or on a cluster; names that a user's files
share with ours."""
