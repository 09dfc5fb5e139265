struct low *low_make(int a, int b);
