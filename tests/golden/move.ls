/PROG MOVE
/ATTR
OWNER = MNEDITOR;
LINE_COUNT = 16;
PROTECT = READ_WRITE;
DEFAULT_GROUP = 1,*,*,*,*;
/MN
   1:  ! written by: ocp-traj VERSION ;
   2:  ! problem: ;
   3:  ! examples.own_robot:build ;
   4:  ! points: 8 ;
   5:  ! verdict: nothing of the motion ;
   6:  ! is proved: the controller times ;
   7:  ! it anew ;
   8:  ! joint 3 shown: q3 + q2 ;
   9:J P[1] 10% CNT100 ;
  10:J P[2] 4% CNT100 ;
  11:J P[3] 23% CNT100 ;
  12:J P[4] 26% CNT100 ;
  13:J P[5] 41% CNT100 ;
  14:J P[6] 45% CNT100 ;
  15:J P[7] 38% CNT100 ;
  16:J P[8] 5% FINE ;
/POS
P[1]{
   GP1:
    UF : 0, UT : 1,
    J1= 44.805300 deg, J2= -60.962709 deg, J3= 22.459946 deg,
    J4= -108.518206 deg, J5= -106.799333 deg, J6= -22.574537 deg
};
P[2]{
   GP1:
    UF : 0, UT : 1,
    J1= 44.305701 deg, J2= -60.203698 deg, J3= 23.798552 deg,
    J4= -108.315376 deg, J5= -106.702105 deg, J6= -21.762751 deg
};
P[3]{
   GP1:
    UF : 0, UT : 1,
    J1= 31.971045 deg, J2= -47.097131 deg, J3= 45.034483 deg,
    J4= -101.470826 deg, J5= -106.111784 deg, J6= -9.511099 deg
};
P[4]{
   GP1:
    UF : 0, UT : 1,
    J1= 14.438536 deg, J2= -50.993244 deg, J3= 29.621918 deg,
    J4= -87.204176 deg, J5= -105.195051 deg, J6= -16.501184 deg
};
P[5]{
   GP1:
    UF : 0, UT : 1,
    J1= -4.182592 deg, J2= -57.123892 deg, J3= 23.720453 deg,
    J4= -93.793191 deg, J5= -74.369922 deg, J6= 7.505747 deg
};
P[6]{
   GP1:
    UF : 0, UT : 1,
    J1= -68.754935 deg, J2= -102.101079 deg, J3= -25.439326 deg,
    J4= -103.819952 deg, J5= -69.270597 deg, J6= 12.662367 deg
};
P[7]{
   GP1:
    UF : 0, UT : 1,
    J1= -19.308258 deg, J2= -128.392746 deg, J3= -60.618191 deg,
    J4= -55.923536 deg, J5= -54.144196 deg, J6= 28.191144 deg
};
P[8]{
   GP1:
    UF : 0, UT : 1,
    J1= -18.334649 deg, J2= -128.629025 deg, J3= -60.962709 deg,
    J4= -55.175836 deg, J5= -53.858033 deg, J6= 28.476002 deg
};
/END
